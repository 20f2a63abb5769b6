"""Scripts that run the other side of rows, each row by itself, and write ``values.json``.

The file holds ``version`` (what ran), ``values`` (id -> numbers, column by column, of complex ones
first the real parts) and ``errors`` (id -> message).
"""

import json

from from_matlab.given import Arrays
from from_matlab.rows import Row

OCTAVE_PACKAGES = ("signal", "statistics", "optim", "control")
R_PACKAGES = ("lme4", "lmerTest", "pbkrtest", "emmeans")

# --- Octave -------------------------------------------------------------------------------------

# The first line makes the file a script although functions follow.
_OCTAVE_START = """1;
warning off;
function text = as_json (value)
  value = full (value(:));
  if (! isreal (value)) value = [real(value); imag(value)]; end
  numbers = arrayfun (@(x) sprintf ("%.17g", x), double (value).', "UniformOutput", false);
  text = ["[" strjoin(regexprep (numbers, "-?(NaN|Inf)", "null"), ", ") "]"];
end
function text = entry (id, value)
  text = ["\\"" id "\\": " value];
end
function text = quoted (message)
  text = ["\\"" regexprep(message, "[^A-Za-z0-9 _.,:;()=-]", " ") "\\""];
end
"""
_OCTAVE_END = """
versions = {entry("Octave", quoted (version))};
for name = packages
  versions{end+1} = entry (name{1}, quoted (pkg ("list", name{1}){1}.version));
end
f = fopen ("values.json", "w");
fprintf (f, "%s", ["{\\"version\\": {" strjoin(versions, ", ") "}, \\"errors\\": {" ...
  strjoin(errors, ", ") "}, \\"values\\": {" strjoin(values, ", ") "}}"]);
fclose (f);
"""


def octave(rows: tuple[Row, ...], arrays: Arrays) -> str:
    """Return a script for Octave with one function a row: none sees another's variables.

    Parameters
    ----------
    rows : tuple of Row
        What to run.
    arrays : dict
        Names of the given data; ``NAME.csv`` lies beside the script.
    """
    names = ", ".join(f'"{name}"' for name in OCTAVE_PACKAGES)
    parts = [_OCTAVE_START, f"packages = {{{names}}};"]
    parts += [f"pkg load {name}" for name in OCTAVE_PACKAGES]
    unpack = " ".join(f"{name} = g.{name};" for name in arrays)
    parts += [
        f"function result = row_{k} (g)\n{unpack}\n{row.code}\nresult = {row.theirs};\nend"
        for k, row in enumerate(rows)
    ]
    parts += [f'g.{name} = dlmread ("{name}.csv");' for name in arrays]
    parts.append("values = {}; errors = {};")
    parts += [
        f'try\n values{{end+1}} = entry ("{row.id}", as_json (row_{k} (g)));\n'
        f'catch e\n errors{{end+1}} = entry ("{row.id}", quoted (e.message));\nend'
        for k, row in enumerate(rows)
    ]
    return "\n".join([*parts, _OCTAVE_END])


# --- R ------------------------------------------------------------------------------------------

_R_START = r"""
suppressPackageStartupMessages({ library(lmerTest); library(pbkrtest); library(emmeans) })
read <- function(name) {
  table <- as.matrix(read.csv(paste0(name, ".csv"), header = FALSE))
  if (ncol(table) == 1) as.vector(table) else unname(table)
}
as_json <- function(x) {
  paste0("[", paste(sprintf("%.17g", as.vector(as.matrix(x))), collapse = ", "), "]")
}
entry <- function(id, value) paste0("\"", id, "\": ", value)
quoted <- function(text) paste0("\"", gsub("[^A-Za-z0-9 _.,:;()=-]", " ", text), "\"")
values <- character(); errors <- character()
run <- function(id, row) {
  tryCatch(values <<- c(values, entry(id, as_json(row()))),
           error = function(e) errors <<- c(errors, entry(id, quoted(conditionMessage(e)))))
}
"""
_R_END = r"""
versions <- c(entry("R", quoted(as.character(getRversion()))),
              sapply(packages, function(p) entry(p, quoted(as.character(packageVersion(p))))))
cat("{\"version\": {", paste(versions, collapse = ", "), "}, \"errors\": {",
    paste(errors, collapse = ", "), "}, \"values\": {", paste(values, collapse = ", "), "}}",
    sep = "", file = "values.json")
"""


def r(rows: tuple[Row, ...], arrays: Arrays) -> str:
    """Return a script for R with one function a row.

    Parameters
    ----------
    rows, arrays
        As of :func:`octave`.
    """
    names = ", ".join(f'"{name}"' for name in R_PACKAGES)
    parts = [_R_START, f"packages <- c({names})"]
    parts += [f'{name} <- read("{name}")' for name in arrays]
    parts += [f'run("{row.id}", function() {{\n{row.code}\n{row.theirs}\n}})' for row in rows]
    return "\n".join([*parts, _R_END])


# --- spm1d --------------------------------------------------------------------------------------

_SPM1D_START = """
import json
import numpy as np
import scipy
import spm1d

given, values, errors = {}, {}, {}


def run(name, code, expression):
    names = dict(given, np=np, spm1d=spm1d)
    try:
        exec(code, names)
        found = np.asarray(eval(expression, names), dtype=float)
    except Exception as exc:
        errors[name] = repr(exc)
    else:
        values[name] = found.ravel(order="F").tolist()

"""
_SPM1D_END = """
version = {m.__name__: m.__version__ for m in (spm1d, np, scipy)}
with open("values.json", "w") as file:
    json.dump({"version": version, "errors": errors, "values": values}, file)
"""


def spm1d(rows: tuple[Row, ...], arrays: Arrays) -> str:
    """Return a script for a Python that has spm1d.

    Parameters
    ----------
    rows, arrays
        As of :func:`octave`.
    """
    parts = [_SPM1D_START]
    parts += [
        f"given[{name!r}] = np.loadtxt({name + '.csv'!r}, delimiter=',', ndmin={array.ndim})"
        for name, array in arrays.items()
    ]
    parts += [f"run({row.id!r}, {json.dumps(row.code)}, {row.theirs!r})" for row in rows]
    return "\n".join([*parts, _SPM1D_END])
