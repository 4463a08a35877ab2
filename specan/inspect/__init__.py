"""The interactive page: one recording, or one study, in the browser of this machine.

Decisions: docs/decisions/page.md.
"""
