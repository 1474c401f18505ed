import ast

from architecture.tree import functions, name, sources

LONGEST_FILE, LONGEST_FUNCTION = 300, 40  # lines; a function's docstring does not count


def test_files_stay_short():
    lengths = {name(path): len(path.read_text(encoding="utf-8").splitlines()) for path in sources()}
    assert {path: lines for path, lines in lengths.items() if lines > LONGEST_FILE} == {}


def test_functions_stay_short():
    lengths = {
        f"{name(path)}:{function.lineno} {function.name}": _lines(function)
        for path in sources()
        for function in functions(path)
    }
    assert {where: lines for where, lines in lengths.items() if lines > LONGEST_FUNCTION} == {}


def _lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    start = function.body[0].end_lineno if ast.get_docstring(function) else function.lineno
    return (function.end_lineno or 0) - (start or 0)
