"""A ray tracer for framelet batches and whole frames, on NVIDIA Warp."""
