"""The server on systems that this machine is not: what they lack is taken away (decision 28)."""
