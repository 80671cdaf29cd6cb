"""Views made by worker processes of Dask: on this machine, or on all that a running scheduler has (`docs/scale.md`)."""
