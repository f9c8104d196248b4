"""The workbench: models and properties in the browser, edited, checked, sampled and drawn.

`command` starts it; `app` answers the browser and keeps others out; `project` reads and writes
files; `language` has what the editor shows; `processes` runs `worker`, a process that does `jobs`
and can be killed.
"""
