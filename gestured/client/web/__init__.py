"""What the pages that gestured serves share: who may come in, what waits for a browser, and how it is served."""
