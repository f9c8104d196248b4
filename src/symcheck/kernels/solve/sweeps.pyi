from symcheck.kernels.solve.equations import Part

class Block(Part):
    def interval(self, goal: float, relative: bool, budget: int) -> tuple[bool, int, float]: ...
    def optimistic(
        self, goal: float, relative: bool, budget: int, fresh: bool = True
    ) -> tuple[bool, int, float]: ...
