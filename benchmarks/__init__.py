"""Accuracy, speed and memory beside the usual tools; see README.md here."""
