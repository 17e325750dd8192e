"""Measurement: cost model, quality, run records, figures, reports, and the wiring of experiments."""
