"""list assets, write one as a mesh, or import a mesh as a new asset"""

import json
import keyword
import math
import re
from dataclasses import Field, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from ...assets.kits import kit, kits
from ...compose import composed
from ...errors import BadConfig, cut
from ...export.mesh import FORMATS, encode
from ...params import parameters
from ...pictures import render
from ...work.targets import try_file, try_folder
from . import FAILED, OK, Arguments, intake, out, remark, say, write, write_json
from .settings import read

if TYPE_CHECKING:
    from ...intake.asset import MeshAsset


MAX_FILLED = 1.1
"""Volume of the pieces over that of the mesh above which a remark says that hollows are filled in part."""
_NAMES = ("name", "to", "mesh", "json")
"""Settings that say what to do and where the list goes. All others are about an imported mesh."""


@dataclass(frozen=True)
class AssetSettings:
    """Settings of `scengen asset`; conf/command/asset.yaml explains them."""

    name: str | None
    to: str | None
    mesh: str | None
    units: str | None
    up: str | None
    mass: float | None
    density: float | None
    friction: float
    error: float
    pieces: int
    seed: int
    json: str | None

    def check(self) -> None:
        """Raise `BadConfig` for settings that do not go together."""
        if self.name is not None and self.mesh is not None:
            raise BadConfig("name= writes an asset as a mesh, mesh= imports a mesh as an asset; give one of them")
        if self.to is None and (self.name is not None or self.mesh is not None):
            where = "to=FILE.stl" if self.mesh is None else "to=FOLDER"
            raise BadConfig(f"asset needs {where}; see scengen asset --help")
        if self.to is not None and self.name is None and self.mesh is None:
            raise BadConfig(f"to = {cut(self.to)}, without an asset; give name=ASSET or mesh=FILE")
        if self.json is not None and self.to is not None:
            raise BadConfig(
                "json= is for the list of assets; an imported mesh has its figures in asset.json; leave it out"
            )
        if self.mesh is None and (
            unused := [f.name for f in fields(self) if f.name not in _NAMES and self._is_given(f)]
        ):
            raise BadConfig(f"{', '.join(unused)}: settings of an imported mesh; give mesh=FILE, or leave them out")

    def _is_given(self, setting: "Field[Any]") -> bool:
        """Whether a setting differs from its default."""
        return getattr(self, setting.name) != composed("asset", [])[0][setting.name]


def command(arguments: Arguments) -> int:
    settings = read("asset", arguments, AssetSettings)
    settings.check()
    if settings.mesh is not None:
        return _import_mesh(settings, Path(str(settings.to)))
    if settings.name is not None:
        return _write_mesh(settings.name, Path(str(settings.to)))
    out.print(_table())
    out.print(_classes())
    if settings.json:
        write_json(settings.json, {name: _plain(kind()) for name, kind in kits().items()})
    return OK


def _plain(prop: Any) -> list[dict[str, Any]]:
    """The parameters of an asset as plain data."""
    return [{key: getattr(p, key) for key in ("name", "nominal", "low", "high", "unit")} for p in parameters(prop)]


def _table() -> Table:
    table = Table("asset", "parameter", "nominal", "range", "unit")
    for name, kind in kits().items():
        for i, p in enumerate(parameters(kind())):
            table.add_row("" if i else name, p.name, f"{p.nominal:g}", f"{p.low:g} to {p.high:g}", p.unit)
    return table


def _classes() -> Table:
    table = Table("asset", "in a family")
    for name, kind in kits().items():
        table.add_row(name, f"from {kind.__module__} import {kind.__name__}")
    return table


def _write_mesh(name: str, target: Path) -> int:
    prop = kit(name)
    if target.suffix not in FORMATS:
        raise BadConfig(f"to = {cut(str(target))}; name a file that ends in {', '.join(FORMATS)}")
    try_file(target)
    write(target, encode(prop, target.suffix))
    say(f"wrote {target}")
    return OK


def _import_mesh(settings: AssetSettings, folder: Path) -> int:
    asset = intake("asset")
    names = [field.name for field in fields(asset.IntakeRequest)]
    request = asset.IntakeRequest(**{name: getattr(settings, name) for name in names})
    request.check()
    try_folder(folder)
    if known := asset.stored_figures(request, folder):
        say(f"{folder} already holds this mesh with these settings; nothing was computed")
        return _report(known, folder)
    taken = asset.make_asset(request)
    figures = taken.figures()
    _write(taken, figures, folder)
    return _report(figures, folder)


def _write(taken: "MeshAsset", figures: dict[str, Any], folder: Path) -> None:
    """Write the files of an asset. The figures come last: they vouch for the others."""
    from ...intake.preview import preview
    from ...intake.urdf import files

    for name, content in files(taken.prop):
        write(folder / name, content)
    for name, content in taken.files.items():
        write(folder / name, content)
    try:
        write(folder / "preview.png", render.encode(preview(taken.prop), "png"))
        names = "prop.json, asset.xml, asset.urdf with its meshes, asset.json and preview.png"
    except render.NoPictures as error:
        remark(f"{folder} has no preview.png: {error}")
        names = "prop.json, asset.xml, asset.urdf with its meshes, and asset.json"
    write(folder / "asset.json", json.dumps(figures, indent=1) + "\n")
    say(f"wrote {names} in {folder}")


def _report(figures: dict[str, Any], folder: Path) -> int:
    """Print the figures, and how a task uses the asset.

    Returns:
        Exit status: whether the asset is as accurate as requested, and comes to rest.
    """
    error, hull, rest = figures["error"], figures["error_of_one_hull"], figures["rest"]
    tolerance = figures["settings"]["error"]
    is_accurate, count = max(error["outward"], error["inward"]) <= tolerance, figures["pieces"]
    say(
        f"{count} convex piece{'s' * (count > 1)}: {1000 * error['outward']:.2f} mm too far out and "
        f"{1000 * error['inward']:.2f} mm too far in at most, {error['volume']:.3f} times the volume; "
        f"one convex hull: {1000 * hull['outward']:.2f} mm, {hull['volume']:.3f} times"
    )
    say(
        f"{figures['mass']:.3g} kg; released on the table it moves by {1000 * rest['creep']:.3f} mm in 2 s, "
        f"at {1000 * rest['speed']:.2f} mm/s at most"
    )
    say(_about_sides(figures))
    if colours := figures["colours"]:
        say(f"{colours} colour{'s' * (colours > 1)} of the file in pictures; MuJoCo's text holds no textures")
    if count >= figures["settings"]["pieces"] > 1 or error["volume"] > MAX_FILLED:
        limit = ", the limit," if count >= figures["settings"]["pieces"] > 1 else ""
        what = f"{count} piece{'s' * (count > 1)}{limit} with {error['volume']:.2f} times the volume"
        hollow = "a hollow asset with the sizes of yours (cup, bowl, dish, bin: scengen asset)"
        remark(f"{what}: hollows are narrower than in the mesh; allow more pieces=, a smaller error=, or take {hollow}")
    if not is_accurate:
        say(f"MISSED: the error of {1000 * tolerance:g} mm; allow more pieces or a larger error")
    if not rest["rests"]:
        say("MISSED: it does not come to rest; give it a flat foot, or set a smaller error")
    say("in a task:")
    for line in _lines(folder):
        say(line)
    return OK if is_accurate and rest["rests"] else FAILED


def _lines(folder: Path) -> tuple[str, str]:
    """Lines of a family that has the asset as a field. In a package, they name it relative to the package's files."""
    whole = folder.resolve()
    package = next((place for place in whole.parents if (place / "__init__.py").is_file()), None)
    where = json.dumps(str(folder), ensure_ascii=False)
    if package is not None:
        where = f"{json.dumps(whole.relative_to(package).as_posix(), ensure_ascii=False)}, __file__"
    name = re.sub(r"\W+", "_", whole.name).strip("_").lower()
    name = name if name.isidentifier() and not keyword.iskeyword(name) else "thing"
    return "from scengen.assets.mesh_prop import MeshProp", f"{name}: MeshProp = MeshProp.load({where})"


def _about_sides(figures: dict[str, Any]) -> str:
    """The axis of the file that points up, the reason, and the side on which the asset stands after the drop."""
    given, rest = figures["settings"]["up"], figures["rest"]
    is_gltf = figures["input"]["file"].lower().endswith(".glb")
    why = "as given" if given else "as glTF defines" if is_gltf else "the default; give up=AXIS if it is another one"
    lean = math.degrees(rest["lean"])
    oblique = f", tilted by {lean:.0f} deg" if lean > 1.0 else ""
    return (
        f"its {figures['up']} axis points up ({why}); on the table it "
        f"{'fell over and lies' if rest['fell'] else 'stands'} on its {rest['side_below']} side{oblique}"
    )
