"""Estimates of every pixel, filtered over time and space, for policies that accumulate samples."""
