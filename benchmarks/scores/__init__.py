"""Measures: pure functions of estimates and their truth."""
