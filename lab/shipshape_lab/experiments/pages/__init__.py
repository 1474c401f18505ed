"""The sections of docs/results.md, one module an experiment, named as the file that the experiment leaves.

An experiment NAME leaves OUT/NAME.json, which holds two tables: `numbers`, flat and numeric, which go into
docs/results.json as they are, and `about`, which says what they were computed with (seed, code, machine). Where
`about` has a `bundle_digest`, it is that of the shipped bundle: the report refuses to mix two of them.

Its module here has:

- `TITLE: str`, the heading of the section;
- `COMMAND: str`, the command line that makes it;
- `section(numbers, about) -> str`, its Markdown without the heading, from the numbers of all experiments and its
  own `about`.
"""
