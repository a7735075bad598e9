"""The daemon: sockets, files and time around one pure `core.hub.Hub`. `gestured.daemon.cli:main` starts it."""

import os

# This must be set before numpy is imported: else its BLAS starts a thread for every core, and no matrix here is large.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# This must be set before pydantic is imported: else it loads the plugins of all installed packages, such as logfire.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
