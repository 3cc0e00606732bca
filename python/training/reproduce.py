"""Repeats the experiments of Meyer and Reitmann (2026, arXiv:2608.07106) on accuracy. Python 3.11 or later.

    pip install ./python
    python python/training/reproduce.py quick

makes data of meshes (points of whole surfaces, and clean and noisy scans by a static scanner, by BLAINDER's UltraPuck
and by the VLP-32C), trains the networks of a plan with `edgepuck train`, one on each core, and writes their accuracies
to report.md. Data and networks are kept, so that the same command continues an interrupted run. Networks that another
program wrote into the folder `models`, such as train.py, are tested as they are.
"""

import argparse
import hashlib
import json
import math
import os
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import edgepuck as ep

PLANS = Path(__file__).resolve().parents[2] / "assets/reproduce"
HALVES = ("train", "test")
SURFACES = "surfaces/surface"
# Folders of scans, and their sensors. The static scanner is BLAINDER's example.
SENSORS = {"static": "generic-static", "blainder": "blainder-ultrapuck", "vlp32c": "vlp32c"}
# Clouds of the same meshes, and where they lie.
SETS = {
    "uniform samples": SURFACES,
    "static clean": "static/packed/static-clean",
    "static noisy": "static/packed/static-noisy",
    "BLAINDER rotational clean": "blainder/packed/rotational-clean",
    "BLAINDER rotational noisy": "blainder/packed/rotational-noisy",
    "VLP-32C clean": "vlp32c/packed/rotational-clean",
    "VLP-32C noisy": "vlp32c/packed/rotational-noisy",
}
# The defaults of `edgepuck train` that this script counts with.
DEFAULTS = {"epochs": 200, "batch": 24, "schedule": {"kind": "step", "every": 20}}
N_SURFACE_POINTS = 1024
CLOUDS = """ModelNet40's packed clouds: a folder with train.npz and test.npz, or the start of two names
[default: points of the meshes' surfaces]"""


@dataclass(frozen=True)
class Plan:
    """The sizes of the experiments."""

    about: str
    mesh_steps: int  # Steps of each training on scans and surfaces, which differ in size.
    mesh_points: int  # Points of these networks.
    points: list[int]  # Points that networks are trained at, of ModelNet40's clouds.
    tested_points: list[int]  # Points that one of these networks is tested at.
    kept: list[int]  # Points that samplers keep.
    fronts: list[list[int]]  # Widths of the front ends of Critical Points Layers.
    recipe: dict  # That of all networks, before the changes of an experiment.
    most_per_class: list[int] | None = None  # Most clouds of each class to train on, and to test with.

    @staticmethod
    def read(name: str) -> "Plan":
        """The plan of that name in assets/reproduce, or in a TOML file."""
        path = PLANS / f"{name}.toml" if (PLANS / f"{name}.toml").is_file() else Path(name)
        try:
            plan = Plan(**tomllib.loads(path.read_text()))
        except (OSError, tomllib.TOMLDecodeError, TypeError) as error:
            raise SystemExit(f"{path}: expected a plan like those in {PLANS}: {error}") from None
        if not plan.points or not plan.kept or "cpl" in plan.recipe:
            raise SystemExit(f"{path}: expected counts in `points` and `kept`, and no recipe.cpl, which `fronts` sets")
        return plan


@dataclass
class Clouds:
    """One half of a set, in a packed file."""

    path: Path
    points: np.ndarray = field(init=False)  # [clouds, points, 3]
    labels: np.ndarray = field(init=False)
    classes: list[str] = field(init=False)

    def __post_init__(self) -> None:
        with np.load(self.path) as file:
            scaled = "points_i16" in file
            self.points = file["points_i16"] / np.float32(32767) if scaled else file["points"]
            self.labels = file["labels"]
            self.classes = [name.decode() if isinstance(name, bytes) else str(name) for name in file["classes"]]

    def accuracy(self, model: Path, **sampler: object) -> str:
        """The share of clouds that the model names rightly, with its 95 % interval (Wilson 1927)."""
        found = ep.Classifier(model, **sampler)(self.points)
        n, right = len(found), sum(one.index == label for one, label in zip(found, self.labels, strict=True))
        z, share = 1.959964, right / n
        middle = (share + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
        low, high = max(middle - half, 0), min(middle + half, 1)
        return f"{100 * share:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def half_at(place: Path, half: str) -> Path:
    """The packed file of a half of the data at `place`, a folder or the start of two names."""
    files = [place / f"{half}.npz", place.with_name(f"{place.name}-{half}.npz")]
    for file in files:
        if file.is_file():
            return file
    raise SystemExit(f"expected packed clouds in {files[0]} or {files[1]}, found neither")


class Study:
    """The plan, the data and the networks of a run."""

    def __init__(self, plan: Plan, clouds: Path | None, meshes: Path | None, out: Path) -> None:
        self.plan, self.data, self.models = plan, out / "data", out / "models"
        self.models.mkdir(parents=True, exist_ok=True)
        self.make_data(meshes)
        place = clouds or self.data / SURFACES
        self.train, self.test = (Clouds(self.some(half_at(place, half), i)) for i, half in enumerate(HALVES))
        if self.train.classes != self.test.classes:
            raise SystemExit(f"{place}: expected the same classes in both halves")
        self.sets = {at: [Clouds(half_at(self.data / at, half)) for half in HALVES] for at in SETS.values()}
        self.n_points = self.train.points.shape[1]
        for own, most in ((self.train, max(plan.points + plan.kept)), (self.sets[SURFACES][0], plan.mesh_points)):
            n_points = own.points.shape[1]
            if most > n_points:
                raise SystemExit(f"{own.path}: expected clouds of {most} points or more, found {n_points}")
        self.keep_terms(out / "terms.json")

    def make_data(self, meshes: Path | None) -> None:
        if meshes is None:
            meshes = self.data / "shapes"
            if not meshes.exists():
                edgepuck("gen-dataset", "--save-meshes", meshes)
        for folder, sensor in SENSORS.items():
            out = self.data / folder
            if (out / "manifest.json").exists():
                continue
            words = ["--resume"] if out.exists() else []
            # Code 1: some of the meshes could not be scanned.
            edgepuck("gen-dataset", meshes, "--sensor", sensor, "--min-points", 16, "--noise", 0.01, "--out", out, *words,
                     codes=(0, 1))
        for half in HALVES:
            sample_surfaces(meshes, half, self.data / f"{SURFACES}-{half}.npz")

    def some(self, path: Path, half: int) -> Path:
        """The file of the first clouds of each class, if the plan wants so many, or `path`."""
        if self.plan.most_per_class is None:
            return path
        out = self.data / f"some-{HALVES[half]}.npz"
        with np.load(path) as file:
            labels = file["labels"]
            rank = np.zeros(len(labels), int)
            for label in np.unique(labels):
                rank[labels == label] = np.arange((labels == label).sum())
            is_wanted = rank < self.plan.most_per_class[half]
            np.savez(out, **{key: file[key] if key == "classes" else file[key][is_wanted] for key in file})
        return out

    def keep_terms(self, path: Path) -> None:
        """Notes what the report depends on, and refuses to continue a run of other terms."""
        files = [self.train.path, self.test.path, *(clouds.path for pair in self.sets.values() for clouds in pair)]
        digests = [hashlib.sha256(np.ascontiguousarray(Clouds(file).points)).hexdigest() for file in files]
        terms = json.dumps({"version": ep.__version__, "plan": vars(self.plan), "sha256": digests}, indent=1)
        if path.exists() and path.read_text() != terms:
            raise SystemExit(f"{path}: an earlier run had another plan or other data; choose another --out")
        path.write_text(terms)

    def model(self, name: str) -> Path:
        return self.models / f"{name}.safetensors"

    def networks(self) -> dict[str, tuple[Clouds, dict]]:
        """The clouds and the recipe of each network. Those that take longest come first."""
        plan, behind = self.plan, {}
        for n in [*plan.points, *plan.kept]:
            behind[f"random-{n}"] = {"points": n, "sampling": "random"}
        for n in plan.kept:
            behind[f"farthest-{n}"] = {"points": n, "sampling": "fps"}
            for front in plan.fronts:
                # The front end sees all points of the cloud.
                layer = {"points": self.n_points, "sampling": "first", "cpl": {"front": front, "keep": n}}
                behind[f"{cpl(front)}-{n}"] = layer
        networks = {name: (self.train, plan.recipe | changes) for name, changes in behind.items()}
        for at, (clouds, _) in self.sets.items():
            networks[on(at)] = clouds, self.recipe_of_scans(len(clouds.points))
        size = {name: r["points"] * (DEFAULTS | r)["epochs"] * len(c.points) for name, (c, r) in networks.items()}
        return dict(sorted(networks.items(), key=lambda item: -size[item[0]]))

    def recipe_of_scans(self, n_clouds: int) -> dict:
        """As many epochs as have the plan's steps; the rate falls at the same shares of the run."""
        usual = DEFAULTS | self.plan.recipe
        epochs = math.ceil(self.plan.mesh_steps / max(n_clouds // usual["batch"], 1))
        schedule, ratio = dict(usual["schedule"]), epochs / usual["epochs"]
        if schedule["kind"] == "step":
            schedule["every"] = max(round(schedule["every"] * ratio), 1)
        else:
            schedule["warm_up"] *= ratio
        changes = {"points": self.plan.mesh_points, "sampling": "random", "epochs": epochs, "schedule": schedule}
        return self.plan.recipe | changes

    def train_network(self, name: str, clouds: Clouds, recipe: dict) -> None:
        """Trains a network, unless it is there: trained by an earlier run, or elsewhere."""
        model = self.model(name)
        if model.exists():
            card, points = card_of(model), recipe.get("cpl", {"keep": recipe["points"]})["keep"]
            found = card.get("training_set"), card.get("points"), json.loads(card["classes"])
            wanted = name, str(points), clouds.classes
            if found != wanted:
                raise SystemExit(f"{model}: expected a training set, points and classes {wanted}, found {found}")
            return
        file = self.models / f"{name}.toml"
        file.write_text(toml(recipe))
        # One network alone does not keep two cores busy; the bytes do not depend on the threads.
        words = ["--data", clouds.path, "--data-name", name, "--recipe", file, "--out", model]
        log = self.models / f"{name}.log"
        print(f"training {name}: {len(clouds.points)} clouds, {recipe['points']} points; see {log}", file=sys.stderr)
        with log.open("a") as lines:
            edgepuck("train", *words, stderr=lines, env=os.environ | {"RAYON_NUM_THREADS": "1"})

    def train_all(self) -> None:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            trained = [pool.submit(self.train_network, name, *parts) for name, parts in self.networks().items()]
            try:
                for one in trained:
                    one.result()
            except SystemExit:
                pool.shutdown(cancel_futures=True)
                raise

    def tables(self) -> list[str]:
        plan, largest = self.plan, max(self.plan.points)

        def accuracy(name: str) -> str:
            return self.test.accuracy(self.model(name))

        paper = {64: "89.01 % (random), 88.36 % (CPL)"}
        trained_at = [[str(n), accuracy(f"random-{n}"), paper.get(n, "")] for n in plan.points]
        most = self.model(f"random-{largest}")
        tested_at = [
            [str(n), *(self.test.accuracy(most, sampler=sampler, points=n) for sampler in ("random", "fps"))]
            for n in plan.tested_points
            if n <= self.test.points.shape[1]
        ]
        samplers = ["random", "farthest", *map(cpl, plan.fronts)]
        behind = [[name, *(accuracy(f"{name}-{n}") for n in plan.kept)] for name in samplers]
        matrix = [
            [name, *(test.accuracy(self.model(on(at))) for _, test in self.sets.values())] for name, at in SETS.items()
        ]
        origins = [[name, card_of(self.model(name)).get("provenance", "not stated")] for name in self.networks()]
        return [
            table(
                "Networks trained and tested at N points, drawn at random", ["points", "accuracy", "paper"], trained_at
            ),
            table(
                f"The network of {largest} points, tested at others",
                ["points", "random points", "farthest points"],
                tested_at,
            ),
            table(
                "Networks trained behind each sampler, by the points that it keeps",
                ["sampler", *(f"{n} points" for n in plan.kept)],
                behind,
            ),
            table(
                "Datasets of the same meshes; a row is trained on one",
                ["trained", *(f"tested: {name}" for name in SETS)],
                matrix,
            ),
            table("Who trained each network", ["network", "origin"], origins),
        ]


def cpl(front: list[int]) -> str:
    """The name of the networks behind a Critical Points Layer."""
    return "cpl-3-" + "-".join(map(str, front))


def on(place: str) -> str:
    """The name of the network of the set at `place`."""
    return "on-" + place.replace("/", "-")


def sample_surfaces(meshes: Path, half: str, out: Path) -> None:
    """Writes clouds of points that are uniform in area (Osada et al. 2002, 3.3), one a mesh."""
    if out.exists():
        return
    draws, points, names = np.random.default_rng(HALVES.index(half)), [], []
    for path in sorted(meshes.glob(f"*/{half}/*")):
        try:
            mesh = ep.Mesh(path, normalize="unit-sphere")
        except ep.Error as error:
            print(f"skipped: {error}", file=sys.stderr)
            continue
        a, b, c = (mesh.vertices[corner] for corner in mesh.faces.T)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        if not areas.sum() > 0:
            continue
        pick = draws.choice(len(areas), N_SURFACE_POINTS, p=areas / areas.sum())
        root, share = np.sqrt(draws.random((N_SURFACE_POINTS, 1))), draws.random((N_SURFACE_POINTS, 1))
        points.append(a[pick] * (1 - root) + b[pick] * root * (1 - share) + c[pick] * root * share)
        names.append(f"{path.parts[-3]}/{path.stem}")
    if not points:
        raise SystemExit(f"{meshes}: expected meshes in CLASS/{half}, found none")
    classes, labels = np.unique([name.split("/")[0] for name in names], return_inverse=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    begun = out.with_name(f"{half}-begun.npz")
    np.savez(begun, points=np.float32(points), labels=labels, classes=classes, names=names)
    begun.rename(out)


def card_of(model: Path) -> dict[str, str]:
    """What a model file says about its network."""
    with model.open("rb") as file:
        return json.loads(file.read(int.from_bytes(file.read(8), "little")))["__metadata__"]


def toml(values: dict, place: str = "") -> str:
    """A table of TOML, whose numbers, texts and lists are those of JSON."""
    tables = {key: value for key, value in values.items() if isinstance(value, dict)}
    lines = [f"{key} = {json.dumps(value)}\n" for key, value in values.items() if key not in tables]
    return "".join(lines + [f"[{place}{key}]\n{toml(value, f'{place}{key}.')}" for key, value in tables.items()])


def table(title: str, heading: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown, under its title."""
    lines = [heading, ["---"] * len(heading), *rows]
    return f"## {title}\n\n" + "".join(f"| {' | '.join(line)} |\n" for line in lines) + "\n"


def edgepuck(*words: object, codes: tuple[int, ...] = (0,), **settings: object) -> None:
    """Runs the program that the package brings."""
    command = [sys.executable, "-m", "edgepuck", *map(str, words)]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, **settings)
    if done.returncode not in codes:
        raise SystemExit(f"{' '.join(command[2:])}: exit code {done.returncode}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plan", help="quick (minutes), paper (eight hours of one core), full, or a TOML file")
    parser.add_argument("--clouds", type=Path, help=CLOUDS)
    parser.add_argument("--meshes", type=Path, help="folder of CLASS/{train,test}/NAME [default: built-in shapes]")
    parser.add_argument("--out", type=Path, default="data/reproduce", help="folder of the report, data and networks")
    args = parser.parse_args()
    plan = Plan.read(args.plan)
    print(plan.about)
    study = Study(plan, args.clouds, args.meshes, args.out)
    study.train_all()
    report = "".join(study.tables())
    print(report, end="")
    (args.out / "report.md").write_text(report)


if __name__ == "__main__":
    main()
