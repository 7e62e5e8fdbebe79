"""`python -m apollonius` is the command."""

import sys

from apollonius.cli import main

if __name__ == "__main__":  # the processes that train side by side import this file too
    sys.exit(main())
