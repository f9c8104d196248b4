"""Writes the model of a polling system with N stations: `python generate.py N > pollingN.sm`.

O. C. Ibe and K. S. Trivedi: Stochastic Petri net models of polling systems. IEEE Journal on
Selected Areas in Communications 8(9), 1990. The language has no arrays, so that the stations are
written out.
"""

from __future__ import annotations

import argparse

__all__ = ["polling"]


def polling(stations: int) -> str:
    """The model text for `stations` >= 2: N 2^N 3/2 states."""
    lines = [
        "// A cyclic server of stations with room for one job each (Ibe and Trivedi 1990).",
        "ctmc",
        "",
        f"const int N = {stations};",
        "const double walk = 200;     // the server goes on to the next station",
        "const double serve = 1;      // a job is served",
        "const double arrive = 1/N;   // a job comes to a station that has none",
        "",
        "module server",
        "  at : [1..N] init 1;",
        "  busy : bool init false;",
        "",
    ]
    for i in range(1, stations + 1):
        following = i % stations + 1
        lines += [
            f"  [empty{i}]  at={i} & !busy -> walk : (at'={following});",
            f"  [found{i}]  at={i} & !busy -> walk : (busy'=true);",
            f"  [served{i}] at={i} & busy -> serve : (busy'=false) & (at'={following});",
        ]
    lines += [
        "endmodule",
        "",
        "module station1",
        "  job1 : bool init false;",
        "",
        "  []        !job1 -> arrive : (job1'=true);",
        "  [empty1]  !job1 -> true;",
        "  [found1]   job1 -> true;",
        "  [served1]  job1 -> (job1'=false);",
        "endmodule",
        "",
    ]
    lines += [
        f"module station{i} = station1 [ job1=job{i}, "
        f"empty1=empty{i}, found1=found{i}, served1=served{i} ] endmodule"
        for i in range(2, stations + 1)
    ]
    waiting = "+".join(f"(job{i} ? 1 : 0)" for i in range(1, stations + 1))
    return "\n".join([*lines, "", 'rewards "jobs"', f"  true : {waiting};", "endrewards", ""])


def main() -> None:
    """Print the model for the number of stations given on the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("stations", type=int, help="number of stations, at least 2")
    arguments = parser.parse_args()
    if arguments.stations < 2:
        parser.error("a polling system has at least two stations")
    print(polling(arguments.stations), end="")


if __name__ == "__main__":
    main()
