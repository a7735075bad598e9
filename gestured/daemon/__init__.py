"""The daemon: asyncio around one pure recognizer per sensor. `gestured.daemon.cli:main` starts it."""
