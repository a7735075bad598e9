"""The shared parts of the pages that gestured serves: who may come in, what waits for a browser, and the server."""
