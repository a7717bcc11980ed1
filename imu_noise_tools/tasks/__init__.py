"""What a command and a node both call: each use case is one function that returns a result."""
