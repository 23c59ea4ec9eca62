"""Chapters that explain a mismatch: verdict, causes, grounds, next tests."""
