"""Scene files of other programs."""
