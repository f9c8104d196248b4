"""Independent tasks on processes of this machine, on an executor, or on a Dask cluster."""
