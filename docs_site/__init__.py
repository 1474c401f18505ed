"""The documentation as a site; `mkdocs.yml` says how it is built."""
