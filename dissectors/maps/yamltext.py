"""YAML of people one does not know: plain values alone, and none that grows when it is spelled out."""

from __future__ import annotations

from typing import Any, Final

import yaml

_MOST_NODES: Final = 1_000_000
_DEEPEST: Final = 60
_TOO_DEEP: Final = "nested too deeply for a map"
_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Lenient(_Base):  # type: ignore[misc]
    """Tags that a program defines for itself stand for their plain values; what they would merge in is left out."""

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        node.value = [pair for pair in node.value if not (_is_merge(pair[0]) and not _merges(pair[1]))]
        super().flatten_mapping(node)


def _is_merge(key: yaml.Node) -> bool:
    return bool(key.tag == "tag:yaml.org,2002:merge")


def _merges(value: yaml.Node) -> bool:
    listed = value.value if isinstance(value, yaml.SequenceNode) else [value]
    return all(isinstance(one, yaml.MappingNode) for one in listed)


def _plain(loader: Any, _suffix: str, node: yaml.Node) -> Any:
    if isinstance(node, yaml.MappingNode):
        return loader.construct_mapping(node, deep=True)
    if isinstance(node, yaml.SequenceNode):
        return loader.construct_sequence(node, deep=True)
    return str(node.value)


_Lenient.add_multi_constructor("!", _plain)


def load_yaml(text: str, *, lenient: bool = False) -> Any:
    """The content of a YAML text; `lenient` takes tags of programs.

    ValueError, in one line with the line where it stands, for what is no YAML, is nested too deeply, or is over a
    million values long once its aliases are written out.
    """
    loader = None
    try:
        _not_deep(text)
        loader = (_Lenient if lenient else _Base)(text)
        node = loader.get_single_node()
        if node is None:
            return None
        if _size(node) > _MOST_NODES:
            raise ValueError("too long once its aliases are written out")
        return loader.construct_document(node)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}: " if mark is not None else ""
        problem = getattr(error, "problem", None) or "no YAML"
        if "nesting depth" in problem:  # the C scanner of PyYAML 6.0.4 and later reads ahead, and has a limit itself
            problem = _TOO_DEEP
        raise ValueError(" ".join(f"{where}{problem}".split())) from error
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:  # of dates and numbers that are none
        raise ValueError("a value that cannot be read") from error
    finally:
        if loader is not None:
            loader.dispose()


def _not_deep(text: str) -> None:
    """ValueError for a text that is nested deeply, which would overflow the stack of the C loader."""
    depth = 0
    for event in yaml.parse(text, Loader=_Base):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > _DEEPEST:
                raise ValueError(_TOO_DEEP)
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _size(root: yaml.Node) -> int:
    """Nodes of a tree once every alias is written out; more than the most where one holds itself."""
    sizes: dict[int, int] = {}
    ways: list[tuple[yaml.Node, bool]] = [(root, False)]
    while ways:
        node, finished = ways.pop()
        parts = _parts(node)
        if finished:
            sizes[id(node)] = 1 + sum(sizes[id(part)] for part in parts)
        elif id(node) not in sizes:
            sizes[id(node)] = _MOST_NODES + 1  # as long as its parts are not counted: for one that holds itself
            ways.append((node, True))
            ways += [(part, False) for part in parts]
    return sizes[id(root)]


def _parts(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, yaml.SequenceNode) else []
