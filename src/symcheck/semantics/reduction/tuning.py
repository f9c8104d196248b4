"""Limits of the search for symmetries and cones of influence, each with its reason."""

from __future__ import annotations

MAX_SYMMETRY_NODES = 100_000
"""Nodes of the expressions of a model up to which symmetries are looked for: a candidate takes up
to a second then."""

MAX_SYMMETRY_COMPONENTS = 20
"""Components that may be exchanged: the size of an orbit is at most 20!, which has 64 bits."""

MAX_RING_COMPONENTS = 63
"""Components of a ring, whose rotations are those of one number of 64 bits."""

MAX_SYMMETRY_VALUATIONS = 1 << 16
"""Valuations on which two expressions are compared whose normal forms differ."""

MAX_CONE_PARTICIPANTS = 10_000
"""Participants of events up to which a cone of influence is computed, in half a second."""

MAX_CONE_VALUATIONS = 1 << 16
"""Valuations on which it is decided whether some command of a module is always enabled."""
