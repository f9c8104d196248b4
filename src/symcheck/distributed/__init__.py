"""Models whose states are partitioned over the workers of a Dask cluster."""

from symcheck.distributed.model import DistributedModel, explore_on_cluster

__all__ = ["DistributedModel", "explore_on_cluster"]
