from symcheck.kernels.arrays import Floats, Int32s, Int64s
from symcheck.kernels.solve.equations import Equations
from symcheck.kernels.solve.sweeps import Block

class ComponentSolver(Equations):
    def block(self, states: Int32s, x: Floats, wide: bool = False) -> Block: ...
    def store(self, block: Block, x: Floats, strategy: Int64s) -> None: ...
    def sweep_acyclic(self, x: Floats, strategy: Int64s, descending: bool) -> None: ...
    def advance(
        self,
        order: Int32s,
        start: Int64s,
        component: int,
        x: Floats,
        strategy: Int64s,
        depth: Int32s,
        width_per_depth: float,
        relative: bool,
        probability: bool,
        elimination_limit: int,
        counters: Int64s,
    ) -> int: ...
