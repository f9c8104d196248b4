from symcheck.kernels.solve.equations import EquationBlock

class Block(EquationBlock):
    def interval_iteration(
        self, width: float, relative: bool, budget: int
    ) -> tuple[bool, int, float]: ...
    def optimistic_value_iteration(
        self, width: float, relative: bool, budget: int, restart: bool = True
    ) -> tuple[bool, int, float]: ...
