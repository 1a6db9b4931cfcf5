"""Synthetic scenes and recordings: frames or points together with their truth."""
