"""The package's version; `setup.py` and `package.xml` have the same."""

VERSION = "0.1.0"
