"""The command-line suite: one file per verb, thin - parse, one library call, print."""
