"""A language server for models and property files: what an editor asks, and its answers.

`words` and `symbols` read a text of any state, also one with faults; `pieces` parses a model whose
other modules are known; `answers` has what an editor shows, with `completion`, `help` and `fixes`;
`checks` explores models in a process of its own; `server` speaks the protocol (pygls).
"""
