"""Short tables of the pages of evidence, from the long ones on these pages; see `evidence.py`."""

from collections.abc import Mapping, Sequence

from benchmarks.accuracy_overview import NAMES
from benchmarks.doc_parts import part, table_lines, table_of
from benchmarks.evidence_figures import numbers


def kept(page: str) -> list[str]:
    """Return in how many random cases each requested accuracy was kept; `page`: text of docs/accuracy.md."""
    rows = table_of(page, "promise")
    asked = list(dict.fromkeys(row["requested"] for row in rows))
    cases = {row["cases"] for row in rows if row["cases"]}
    rates = []
    for study in dict.fromkeys(row["study"] for row in rows):
        own = {row["requested"]: row["within the request [%]"] for row in rows if row["study"] == study}
        rates.append((NAMES[study], *(f"{own[a]} %" if own.get(a) else "no setting" for a in asked)))
    return [
        f"Of {' or '.join(sorted(cases))} random cases each, within the requested accuracy:",
        "",
        *table_lines(("scene", *(f"requested {a.replace('%', ' %')}" for a in asked)), rates),
    ]


def estimate(page: str) -> list[str]:
    """Return how good the estimate of the error in a run is; `page`: text of docs/accuracy.md."""
    return table_lines(
        ("cases", "true error, median [mm]", "estimate within a factor of 2"),
        [
            (
                row["of"],
                f"{numbers(row['true error [mm], median'])[0]:g}",
                row["estimate / true error within 0.5 to 2"],
            )
            for row in table_of(page, "mesh error")
        ],
    )


def verification(page: str) -> list[str]:
    """Return the largest difference of each kind of check; `page`: text of docs/verification.md."""
    known = [
        row for row in table_of(page, "analytic") if not row["case"].startswith(("patch", "rigid", "free"))
    ]
    published = [{**row, "case": row["problem"]} for row in table_of(page, "external solids")]
    lines: list[tuple[object, ...]] = []
    for title, rows in (("Known solutions", known), ("Published problems", published)):
        for element in ("h20", "h8_modes"):
            lines.append((f"{title}, element `{element}`", len(rows), _largest(rows, element)))
    contact = [
        {**row, "case": row["problem"]}
        for row in table_of(page, "external contact")
        if row["error"].endswith("%")
    ]
    lines.append(("Contact and friction", len(contact), _largest(contact, "error")))
    twin = table_of(page, "calculix")
    most = max(max(numbers(row["nodes [%]"])[0], numbers(row["disc [%]"])[0]) for row in twin)
    lines.append(("CalculiX on the same mesh", len(twin), f"{most:.2g} %"))
    hard = [numbers(row["pass"]) for row in table_of(page, "stability")]
    passed, runs = (f"{sum(column):g}" for column in zip(*hard, strict=True))
    lines.append(("Hard cases: stays finite, untangles, comes to rest", runs, f"{passed} of {runs} pass"))
    return table_lines(("check", "cases", "largest difference"), lines)


def _largest(rows: Sequence[Mapping[str, str]], column: str) -> str:
    """Return the largest difference in a column, and in which case it is."""
    sizes = [abs(numbers(row[column])[0]) for row in rows]
    worst = max(range(len(rows)), key=sizes.__getitem__)
    return f"{sizes[worst]:.2g} % ({rows[worst]['case']})"


def reality(page: str) -> list[str]:
    """Return what was found beside measurements; `page`: text of docs/reality.md."""
    beam = {
        row["quantity"]: abs(100 * (numbers(row["simulated"])[0] / numbers(row["measured"])[0] - 1))
        for row in table_of(page, "beam comparison")
    }
    emio = [numbers(row["held out [mm]"])[0] for row in table_of(page, "emio meshes")]
    lines = []
    for word, title in (("frequency", "frequencies"), ("sag", "sag at rest")):
        most = max(size for name, size in beam.items() if name.startswith(word))
        lines.append((f"Silicone beam, {title}, one modulus for all", f"within {most:.2g} %"))
    places = f"{min(emio):g} to {max(emio):g} mm off, by mesh"
    lines.append(("Emio, places of poses that were not fitted, mean", places))
    for name, title in (("poses", "30 poses"), ("motion", "a motion of 0.8 s")):
        total = next(row for row in table_of(page, f"intervals {name}") if row["value"] == "all")
        robots = part(page, f"intervals {name}")[0].partition(" ")[0]
        what = f"Values identified from {title}, {robots} simulated robots: 90 % intervals that hold the true value"
        lines.append((what, total["with the error of the mesh"]))
    return table_lines(("comparison", "result"), lines)


def speed(page: str) -> str:
    """Return in a sentence how fast the default scene is; `page`: text of docs/speed.md."""
    first = table_of(page, "steps")[0]
    step, median = numbers(first["step"])[0], numbers(first["median [ms]"])[0]
    return (
        f"The default scene of the Tripod takes {median:g} ms of one processor core for a step of {step:g} ms: it "
        f"runs {step / median:.2g} times as fast as real time."
    )
