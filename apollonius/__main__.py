"""`python -m apollonius` is the command."""

import sys

from apollonius.cli import main

sys.exit(main())
