"""Search for the reachable states: schedules over partitioned transition relations."""
