"""The `tripod` command: run a scene, start a node, bring up and supervise the whole chain, check the machine.

Importing this package imports nothing else; each command imports what it needs when it runs.
"""
