"""Helpers that tests share: renders as arrays, comparisons that keep their pictures."""
