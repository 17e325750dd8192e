"""Renderers to compare with, over the same ``trace`` and the same clock as the adaptive pipeline."""
