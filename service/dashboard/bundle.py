"""Bundle of JavaScript modules: a page loads one file instead of 140.

The files stay separate in the source tree. A module becomes a function in the bundle that runs once
and returns the exports of the module, so that equal names in two modules do not clash. Circular
imports, default exports and exported variables that change are not supported.
"""

import posixpath
import re
from collections.abc import Mapping

IMPORT = re.compile(r'^import (\{.*\}) from "(\.{1,2}/[^"]+)";$', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async function|function|class|const) (\w+))", re.MULTILINE)


def _import_order(module: str, texts: Mapping[str, str]) -> list[str]:
    """Return the paths of a module and of all its direct and indirect imports, imports first."""
    found: dict[str, None] = {}

    def visit(path: str) -> None:
        if path not in found:
            for match in IMPORT.finditer(texts[path]):
                visit(_beside(path, match[2]))
            found[path] = None

    visit(module)
    return list(found)


def script_bundle(module: str, texts: Mapping[str, str]) -> str:
    """Return one script that does what a module does.

    Parameters
    ----------
    module : str
        Path of the module, for example ``app.js``.
    texts : mapping of str to str
        Texts of that module and of all modules that it imports, by path.
    """
    return "".join(_function(path, texts[path]) for path in _import_order(module, texts))


def _function(path: str, text: str) -> str:
    """Return a statement that runs a module and assigns its exports to the name of the module."""
    exports = ", ".join(match[1] for match in EXPORT.finditer(text))
    body = IMPORT.sub(
        lambda match: f"const {match[1].replace(' as ', ': ')} = {_name(_beside(path, match[2]))};",
        EXPORT.sub("", text),
    )
    return f"// {path}\nconst {_name(path)} = (() => {{\n{body}return {{ {exports} }};\n}})();\n"


def _beside(path: str, link: str) -> str:
    return posixpath.normpath(posixpath.join(posixpath.dirname(path), link))


def _name(path: str) -> str:
    return "$" + path.removesuffix(".js").replace("/", "$")
