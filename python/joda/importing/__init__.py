"""Logs of robots' own kinds made into runs: read, matched to a model, checked, written."""
