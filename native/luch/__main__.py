"""``python -m luch``: see :mod:`luch.cli`."""

import sys

from luch.cli import main

sys.exit(main())
