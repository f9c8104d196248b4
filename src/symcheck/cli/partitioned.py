"""-distributed: one model whose states are partitioned over the workers of a cluster."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from symcheck.api.checking import PreparedModel
from symcheck.api.model import Model
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result
from symcheck.cli.check_property import check_property
from symcheck.cli.instance import InstancesTask, report_fault, without_faults
from symcheck.cli.output_paths import instance_path
from symcheck.cli.run_state import RunState
from symcheck.distributed import DistributedModel, explore_on_cluster
from symcheck.distributed.parts import Cluster
from symcheck.errors import OutputError, ResourceError, SymcheckError, UsageError
from symcheck.parallel.dask import connect

__all__ = ["check_partitioned"]


@dataclass(frozen=True, eq=False, repr=False)
class _PartitionedModel(Model):
    """A model whose properties are checked where its states are."""

    distributed: DistributedModel | None = None

    def check_instance(self, instance: PropertyInstance, **_: object) -> Result:
        """Check a property on the parts."""
        assert self.distributed is not None
        bound, labels = instance.bind(self.bound)
        return self.distributed.check_formula(bound.formula, labels)


def check_partitioned(
    state: RunState, task: InstancesTask, choices: Sequence[Mapping[str, str]]
) -> None:
    """Check an instance for each choice of constants, one after the other, on all workers.

    Raises as `InstancesTask.run`; UsageError if there is no scheduler, or for an engine that does
    not explore states one by one.
    """
    a, engine = state.arguments, state.options.engine
    assert a.scheduler is not None
    if engine not in ("auto", "explicit"):
        raise UsageError(
            f"-distributed: the states of the {engine} engine are not partitioned",
            hint="leave out its switch, or -distributed",
        )
    with connect(a.scheduler) as client:
        for constants in choices:
            varying = constants if len(choices) > 1 else {}
            _check_instance(state, task, client, constants, varying)


def _check_instance(
    state: RunState,
    task: InstancesTask,
    client: Cluster,
    constants: Mapping[str, str],
    varying: Mapping[str, str],
) -> None:
    a = state.arguments
    model = replace(task.model, given_constants=constants)
    instances = model.instances(task.file, task.of_properties, task.indices)
    folder = None if a.checkpoints is None else Path(instance_path(a.checkpoints, varying))
    try:
        state.output.model(model.bound, constants)
        file = without_faults(state, task.file, model)
        instances = model.instances(file, task.of_properties, task.indices)
        distributed = explore_on_cluster(model, client, checkpoints=folder)
    except (ResourceError, OutputError):
        raise
    except SymcheckError as error:
        report_fault(state, error, instances, constants, alone=not varying)
        return
    state.build_seconds = distributed.seconds
    state.output.partitioned(distributed)
    known = {f.name: getattr(model, f.name) for f in fields(Model) if f.init}
    partitioned = _PartitionedModel(**known, distributed=distributed)
    # No property is named, so that no quotient is made: the states are elsewhere.
    prepared: PreparedModel[Model] = PreparedModel(partitioned, ())
    sizes = distributed.states, distributed.transitions
    for instance in instances:
        check_property(state, prepared, instance, None, varying, sizes=sizes)
