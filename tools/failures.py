"""Reasons for which the episodes of a family fail, read from its code."""

import ast
import inspect
import textwrap


def failures(family: type) -> list[str]:
    """Reasons of failures of a family, in the order in which they are judged."""
    found: list[str] = []
    seen = {"failure"}
    todo = ["failure"]
    for name in todo:  # grows by the methods that also give reasons
        for owner in family.__mro__:
            if name not in vars(owner) or owner.__module__ == "scengen.scenario":
                continue
            tree = ast.parse(textwrap.dedent(inspect.getsource(vars(owner)[name])))
            own, called = _reasons(tree)
            found += own
            todo += [other for other in called if other not in seen and _gives_reasons(family, other)]
            seen.update(called)
            if name != "failure" or not _calls_super(tree):
                break
    return list(dict.fromkeys(found))


def _reasons(tree: ast.AST) -> tuple[list[str], list[str]]:
    """Texts that a method returns, and methods of the family that it returns."""
    texts, called = list[str](), list[str]()

    def look(node: ast.AST | None) -> None:
        match node:
            case ast.Constant(value=str(text)):
                texts.append(text)
            case ast.JoinedStr(values=parts):
                plain = (p.value if isinstance(p, ast.Constant) else "..." for p in parts)
                texts.append("".join(map(str, plain)))
            case ast.Call(func=ast.Attribute(value=ast.Name(id="self"), attr=name)):
                called.append(name)
            case ast.IfExp(body=one, orelse=other):
                look(one)
                look(other)
            case ast.BoolOp(values=parts):
                for part in parts:
                    look(part)

    for node in ast.walk(tree):
        if isinstance(node, ast.Return):
            look(node.value)
    return texts, called


def _gives_reasons(family: type, name: str) -> bool:
    """Whether a method of a family returns reasons."""
    return "str" in str(inspect.signature(getattr(family, name)).return_annotation)


def _calls_super(tree: ast.AST) -> bool:
    return any(isinstance(node, ast.Name) and node.id == "super" for node in ast.walk(tree))
