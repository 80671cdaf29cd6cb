"""The correlation gate of `make test`: a small bank of views, judged."""
