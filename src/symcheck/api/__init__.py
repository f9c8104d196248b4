"""The façade: `symcheck.load("die.pm").check("P=? [ F d=6 ]")`."""
