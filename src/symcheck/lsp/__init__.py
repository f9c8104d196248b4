"""A language server for models and property files: what an editor asks, and its answers.

`words` and `symbols` read a text of any state, also one with faults; `answers` has what an editor
shows; `checks` explores models in a process of its own; `server` speaks the protocol (pygls).
"""
