# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Imports run one way, the core knows no files, heavy things are imported where needed."""

from __future__ import annotations

import ast
import functools
import inspect
from pathlib import Path
import subprocess
import sys

import pytest

from imu_noise_tools.loop.domains import DOMAINS
from imu_noise_tools.loop.effect import registry

PACKAGE = Path(__file__).resolve().parents[1] / 'imu_noise_tools'

# A module imports from layers above it in this list and from its own package only.
LAYERS = (
    ('core',),
    ('loop',),
    ('noise',),
    ('calibration', 'filter'),
    ('simulate',),
    ('health', 'bag'),
    ('store', 'export', 'plots', 'sheet'),
    ('report',),
    ('tasks',),
    ('fleet', 'explore'),
    ('api',),
    ('cli', 'nodes'),
)
LEVEL = {name: i for i, names in enumerate(LAYERS) for name in names}
CORE = {name for name, level in LEVEL.items() if level <= LEVEL['health']} - {'bag'}
OPENS = PACKAGE / 'core' / 'files.py'      # whole or not at all: the one place that writes
HEAVY = {'numpy', 'scipy', 'matplotlib', 'allantools', 'rosbags', 'yaml', 'rclpy', 'dask',
         'zstandard'}
MESSAGES = {'sensor_msgs', 'std_msgs', 'std_srvs', 'diagnostic_msgs', 'rosgraph_msgs',
            'builtin_interfaces'}
FORMATS = {'yaml', 'rosbags', 'csv', 'json', 'sqlite3', 'zipfile', 'argparse',
           'subprocess'}
PICKLES = {'pickle', 'dill', 'cloudpickle', 'joblib', 'shelve', 'marshal'}
FILE_METHODS = {'open', 'read_text', 'write_text', 'read_bytes', 'write_bytes', 'mkdir', 'unlink',
                'savez', 'savez_compressed', 'savetxt', 'loadtxt', 'genfromtxt', 'fromfile',
                'tofile', 'memmap'}


class Source:
    """One file of the package: its layer, its syntax tree, what it imports."""

    def __init__(self, path: Path, text: str | None = None):
        self.path = path
        parts = path.relative_to(PACKAGE).with_suffix('').parts
        self.package = ('imu_noise_tools', *parts[:-1])
        self.layer = '' if parts in (('__init__',), ('__main__',)) else parts[0]
        self.tree = ast.parse(path.read_text(encoding='utf-8') if text is None else text)
        self.nodes = list(ast.walk(self.tree))

    def at(self, line) -> str:
        """Return a place that an editor can jump to."""
        return f'{self.path.relative_to(PACKAGE)}:{line}'

    def imports(self, run=False):
        """
        Return (line, absolute name as a tuple, at module level?) of each, of functions too.

        With ``run``, those alone that are run: a type may know what a thing is handed to.

        """
        return [found for *found, is_run in self._imports if is_run or not run]

    @functools.cached_property
    def _imports(self):
        """All imports, and whether each is run."""
        return list(self._every_import())

    def _every_import(self):
        typed = {id(n) for check in self.nodes if isinstance(check, ast.If)
                 and getattr(check.test, 'id', '') == 'TYPE_CHECKING' for n in ast.walk(check)}
        functions = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
        inside = {id(n) for f in self.nodes if isinstance(f, functions)
                  for n in ast.walk(f)}
        for node in self.nodes:
            if isinstance(node, ast.Import):
                names = [tuple(a.name.split('.')) for a in node.names]
            elif isinstance(node, ast.ImportFrom):
                base = tuple(node.module.split('.')) if node.module else ()
                if node.level:
                    base = self.package[:len(self.package) - node.level + 1] + base
                names = [(*base, a.name) for a in node.names]
            else:
                continue
            for name in names:
                yield node.lineno, name, id(node) not in inside, id(node) not in typed

    def upward(self):
        """Yield places that import a layer which is not below."""
        for line, name, _ in self.imports():
            other = name[1] if name[0] == 'imu_noise_tools' and len(name) > 1 else ''
            if other not in LEVEL or other == self.layer:
                continue
            if LEVEL[other] >= LEVEL.get(self.layer, 0):
                yield f'{self.at(line)} imports {other}'

    def importing(self, libraries, top_only=False):
        """Yield places that import any of these libraries."""
        for line, name, top in self.imports(run=True):
            if name[0] in libraries and (top or not top_only):
                yield f'{self.at(line)} imports {name[0]}'

    def files(self):
        """Yield places that touch the file system or the terminal."""
        for node in self.nodes:
            f = node.func if isinstance(node, ast.Call) else None
            if isinstance(f, ast.Name) and f.id in ('open', 'print', 'input'):
                yield f'{self.at(node.lineno)} {f.id}()'
            if isinstance(f, ast.Attribute) and (f.attr in FILE_METHODS or (
                    f.attr in ('load', 'save') and getattr(f.value, 'id', '') == 'np')):
                yield f'{self.at(node.lineno)} .{f.attr}()'


@pytest.fixture(scope='module')
def sources() -> list[Source]:
    return [Source(p) for p in sorted(PACKAGE.rglob('*.py'))]


def test_the_checks_see_what_they_look_for():
    text = ('from .. import store\nfrom ..report import words as S\nimport matplotlib.pyplot\n'
            'def f():\n    import imu_noise_tools.cli.main\n    np.load(open(path))\n')
    bad = Source(PACKAGE / 'noise' / 'bad.py', text)
    assert [x.split()[-1] for x in bad.upward()] == ['store', 'report', 'cli']
    assert len(list(bad.importing({'matplotlib'}, top_only=True))) == 1
    assert len(list(bad.files())) == 2
    inner = Source(PACKAGE / 'noise' / 'effects' / 'bad.py', 'from ...store import load')
    assert list(inner.upward())
    assert not list(Source(PACKAGE / 'noise' / 'fine.py', 'from ..core import units').upward())
    typed = Source(PACKAGE / 'noise' / 'typed.py',
                   'if TYPE_CHECKING:\n    from ..store import load\n')
    assert list(typed.upward()) and not list(typed.imports(run=True))


def test_every_module_is_in_a_layer(sources):
    unknown = [str(s.path) for s in sources if s.layer and s.layer not in LEVEL]
    assert not unknown, 'put these into a layer of the design'


def test_imports_run_one_way(sources):
    assert not [x for s in sources if s.layer for x in s.upward()]


def test_the_root_imports_nothing(sources):
    """The command line pays for the root before it can print its help; type checkers do not."""
    root = next(s for s in sources if s.path == PACKAGE / '__init__.py')
    unseen = [n for n in root.tree.body if isinstance(n, ast.If)
              and getattr(n.test, 'id', '') == 'TYPE_CHECKING']
    lines = range(unseen[0].lineno, unseen[0].orelse[0].lineno)
    assert len(unseen) == 1 and len(lines) > 10
    assert not [n for line, n, top in root.imports() if top and line not in lines
                and n[0] not in ('__future__', 'sys')]


@pytest.mark.parametrize(('libraries', 'owner'), [
    ({'rclpy'} | MESSAGES, 'nodes'), ({'matplotlib'}, 'plots')])
def test_only_one_layer_imports(sources, libraries, owner):
    assert not [x for s in sources if s.layer != owner for x in s.importing(libraries)]


def test_matplotlib_is_imported_late(sources):
    assert not [x for s in sources for x in s.importing({'matplotlib'}, top_only=True)]


def test_the_core_opens_no_file_and_prints_nothing(sources):
    assert not [x for s in sources if s.layer in CORE and s.path != OPENS
                for x in s.files()]


def test_the_core_knows_no_file_formats(sources):
    assert not [x for s in sources if s.layer in CORE and s.path != OPENS
                for x in s.importing(FORMATS)]


def test_nothing_is_unpickled_and_no_yaml_object_is_built(sources):
    wrong = [x for s in sources for x in s.importing(PICKLES)]
    for s in sources:
        for node in s.nodes:
            if isinstance(node, ast.keyword) and node.arg == 'allow_pickle' \
                    and getattr(node.value, 'value', True) is not False:
                wrong.append(f'{s.at(node.value.lineno)} allow_pickle')
            if isinstance(node, ast.Attribute) and node.attr in (
                    'unsafe_load', 'full_load', 'UnsafeLoader', 'FullLoader', 'Loader'):
                wrong.append(f'{s.at(node.lineno)} {node.attr}')
    assert not wrong


def test_no_bare_except(sources):
    assert not [s.at(n.lineno) for s in sources for n in s.nodes
                if isinstance(n, ast.ExceptHandler) and n.type is None]


def size(function) -> tuple[int, int]:
    """Return the lines of a function without its docstring, and the names that it binds."""
    own = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.ListComp, ast.SetComp,
           ast.DictComp, ast.GeneratorExp)
    inner = {id(n) for f in ast.walk(function) if f is not function and isinstance(f, own)
             for n in ast.walk(f)}
    names = {a.arg for a in ast.walk(function.args) if isinstance(a, ast.arg)}
    names |= {n.id for n in ast.walk(function) if isinstance(n, ast.Name)
              and isinstance(n.ctx, ast.Store) and id(n) not in inner}
    first = function.body[0]
    said = first.end_lineno - first.lineno + 1 if ast.get_docstring(function) else 0
    return function.end_lineno - function.lineno + 1 - said, len(names)


def test_size_counts_what_it_should():
    text = 'def f(a, *, b):\n    """Say\n\n    it."""\n    c = [d for d in a]\n    return c\n'
    assert size(ast.parse(text).body[0]) == (3, 3)


def test_functions_are_short(sources):
    """A function of more than 60 lines or 25 names is several functions."""
    long = {f'{s.at(f.lineno)} {f.name}': found for s in sources for f in s.nodes
            if isinstance(f, (ast.FunctionDef, ast.AsyncFunctionDef))
            and ((found := size(f))[0] > 60 or found[1] > 25)}
    assert not long, '(lines, names)'


def untyped(tree):
    """Yield public functions at module level and public methods that leave a type open."""
    for owner in (tree, *(n for n in tree.body if isinstance(n, ast.ClassDef))):
        for f in (n for n in owner.body if isinstance(n, ast.FunctionDef)):
            given = [*f.args.posonlyargs, *f.args.args, *f.args.kwonlyargs]
            bound = owner is not tree and given[:1] and given[0].arg in ('self', 'cls')
            if not f.name.startswith('_') and (
                    f.returns is None or any(a.annotation is None for a in given[bool(bound):])):
                yield f


def test_an_open_type_is_seen():
    text = 'def f(a: int): pass\nclass A:\n    def g(self, b) -> int: pass\n    def _h(x): pass\n'
    assert [f.name for f in untyped(ast.parse(text))] == ['f', 'g']
    assert not list(untyped(ast.parse('class A:\n    def g(self) -> int: pass\n')))


def test_public_functions_state_their_types(sources):
    assert not [f'{s.at(f.lineno)} {f.name}' for s in sources for f in untyped(s.tree)]


def test_the_loop_knows_no_problem(sources):
    some = [s for s in sources if s.layer == 'loop']
    known = {name[1] for s in some for _, name, _ in s.imports() if name[0] == 'imu_noise_tools'}
    assert len(some) >= 5 and known <= {'core', 'loop'}


def module_of(name) -> tuple[str, ...] | None:
    """Return the module of the package that an imported name is of, or None."""
    for parts in (name, name[:-1]):
        path = PACKAGE.parent.joinpath(*parts)
        if path.with_suffix('.py').is_file():
            return tuple(parts)
        if (path / '__init__.py').is_file():
            return (*parts, '__init__')
    return None


def graph(sources) -> dict[tuple, set[tuple]]:
    """Return the modules that each module imports, in functions too."""
    out = {}
    for s in sources:
        me = ('imu_noise_tools', *s.path.relative_to(PACKAGE).with_suffix('').parts)
        found = {module_of(n) for _, n, _ in s.imports(run=True) if n[0] == 'imu_noise_tools'}
        out[me] = {m for m in found if m is not None} - {me}
    return out


def circles(edges) -> list[list]:
    """Return the sets of modules that lead to each other (Tarjan's components of two and more)."""
    index, low, stack, out = {}, {}, [], []

    def visit(v):
        index[v] = low[v] = len(index)
        stack.append(v)
        for w in edges.get(v, ()):
            if w not in index:
                visit(w)
                low[v] = min(low[v], low[w])
            elif w in stack:
                low[v] = min(low[v], index[w])
        if low[v] == index[v]:
            at = stack.index(v)
            found, stack[at:] = stack[at:], []
            if len(found) > 1:
                out.append(sorted('.'.join(x[1:]) for x in found))

    for v in edges:
        if v not in index:
            visit(v)
    return out


def test_circles_are_seen():
    assert circles({1: {2}, 2: {3}, 3: set()}) == []
    a, b, c = (('p', x) for x in 'abc')
    assert circles({a: {b}, b: {c}, c: {a}}) == [['a', 'b', 'c']]


def test_no_module_leads_back_to_itself(sources):
    """Not through a function either."""
    assert circles(graph(sources)) == []


def test_rooms_import_the_package_at_their_top(sources):
    """An import in a function hides a circle, or that a thing is somewhere else than it should."""
    rooms = ('core', 'loop', 'noise', 'calibration', 'filter')
    assert not [s.at(line) for s in sources if s.layer in rooms
                for line, name, top in s.imports() if name[0] == 'imu_noise_tools' and not top]


def test_nothing_is_imported_for_its_side_effect(sources):
    wrong = [s.at(i) for s in sources
             for i, line in enumerate(s.path.read_text(encoding='utf-8').splitlines(), 1)
             if 'F401' in line]
    assert not wrong


def test_nobody_asks_for_a_member_by_its_name(sources):
    """What a thing can do, its base class says, with a default."""
    rooms = ('core', 'loop', 'noise', 'calibration', 'filter', 'health', 'store', 'plots',
             'report', 'tasks')
    asked = {f'{s.at(n.lineno)} {n.args[1].value}' for s in sources if s.layer in rooms
             for n in s.nodes if isinstance(n, ast.Call)
             and getattr(n.func, 'id', '') in ('getattr', 'hasattr')
             and isinstance(n.args[1], ast.Constant)}
    assert {x.split()[-1] for x in asked} == {'CSafeLoader'}, asked     # where PyYAML has libyaml
    assert not [s.at(n.lineno) for s in sources if s.layer == 'loop' for n in s.nodes
                if isinstance(n, ast.Call) and getattr(n.func, 'id', '') in ('getattr', 'hasattr')]


def branches(source):
    """Yield places that ask whether a domain is a certain one."""
    words = {ast.Attribute: 'attr', ast.Name: 'id', ast.Constant: 'value'}
    for n in (n for n in source.nodes if isinstance(n, ast.Compare)):
        said = {getattr(x, words[type(x)]) for x in ast.walk(n) if type(x) in words}
        if 'domain' in said and said & {*DOMAINS}:
            yield source.at(n.lineno)


def test_nobody_goes_by_the_name_of_a_domain(sources):
    """What is its own, a domain says; tasks of one alone refuse the studies of the others."""
    text = 'a.domain == "noise"\nb["domain"] in ("filter", x)\na.domain != b.domain\n'
    assert len(list(branches(Source(PACKAGE / 'cli' / 'bad.py', text)))) == 2
    assert not [x for s in sources if s.layer != 'tasks' for x in branches(s)]


# Where a string that is the name of an effect may stand outside the file of that effect, and why.
NAMED = {
    'noise/effects/drift.py': 'a feature of the mean that a ramp explains as well',
    'noise/null.py': 'thresholds, drawn effect by effect',
    'noise/classic.py': 'the classic rules of reading a curve: Q N B K R',
    'export/_values.py': 'N, B and K, which exports map to what others read',
    'sheet.py': 'N, B and K as sheets state them',
    'tasks/plan.py': 'N, B and K given on the command line',
    'tasks/noise.py': 'the base model',
    'filter/problem.py': 'the base model',
    'filter/design.py': 'the base noise',
    'filter/engine.py': 'the base noise',
    'tasks/filter.py': 'the base noise',
    'cli/filter.py': 'the base noise',
    'nodes/filter.py': 'the base noise',
    'calibration/solve.py': 'the base model: S and b',
    'calibration/linear.py': 'the base model: S and b',
    'calibration/correction.py': 'the base model: S and b',
    'calibration/solution.py': 'the base model: S and b',
    'tasks/demo.py': 'what the demonstration hides',
}
# Names of effects that are words for other things as well.
WORDS = {'white', 'step', 'bias', 'scale', 'temperature', 'duplicates', 'constant_rate', 'shock',
         'tilt', 'drift'}


def test_an_effect_is_named_in_its_own_file_alone(sources):
    """Nothing goes by an effect's name: what it can do, it says."""
    home = {}
    for domain in DOMAINS:
        for name, cls in registry(domain).items():
            home.setdefault(name, set()).add(Path(inspect.getfile(cls)))
    wrong, used = [], set()
    for s in sources:
        docs = {id(n.value) for n in s.nodes if isinstance(n, ast.Expr)}
        for n in s.nodes:
            name = n.value if isinstance(n, ast.Constant) and id(n) not in docs else None
            if not isinstance(name, str) or s.path in home.get(name, (s.path,)):
                continue
            where = s.path.relative_to(PACKAGE).as_posix()
            if where in NAMED:
                used.add(where)
            elif name not in WORDS:
                wrong.append(f'{s.at(n.lineno)} names {name}')
    assert not wrong
    assert used == set(NAMED), 'no exception that nothing needs'


def test_only_its_own_file_names_a_noise_effect(sources):
    """An effect registers itself: nothing in noise/ or the loop imports one by its class."""
    folder = PACKAGE / 'noise' / 'effects'
    home = {n.name: s.path for s in sources if s.path.parent == folder for n in s.tree.body
            if isinstance(n, ast.ClassDef)}
    assert len(home) >= 8
    assert not [s.at(line) for s in sources if s.layer in ('noise', 'loop', 'store')
                for line, name, _ in s.imports()
                if name[:3] == ('imu_noise_tools', 'noise', 'effects')
                and home.get(name[-1], s.path) != s.path]


def _loaded(code: str) -> set[str]:
    code += '\nprint(" ".join(sorted({*sys.modules, *(m.split(".")[0] for m in sys.modules)})))'
    out = subprocess.run([sys.executable, '-c', 'import sys\n' + code], capture_output=True,
                         text=True, check=True, cwd=PACKAGE.parent)
    return set(out.stdout.split())


def _needs_command_line():
    if not (PACKAGE / 'cli' / 'main.py').is_file():
        pytest.skip('there is no command line yet')


def test_importing_the_command_line_is_light():
    _needs_command_line()
    assert not _loaded('import imu_noise_tools.cli.main') & HEAVY


def test_an_analysis_does_not_load_filters():
    """Half a second each time, for a recursion of one pole."""
    code = ('import numpy as np\nfrom imu_noise_tools.core.record import ImuRecord\n'
            'from imu_noise_tools.tasks.noise import analyse_record\n'
            'y = np.random.default_rng(1).standard_normal((6000, 3))\n'
            "analyse_record(ImuRecord(y, None, 0.01 * np.arange(6000), 100.0), axes=['gyro_x'])")
    assert not {'scipy.signal', 'scipy.stats'} & _loaded(code)


def test_printing_the_help_is_light():
    """The whole parser is built for it, so every command's arguments are."""
    _needs_command_line()
    assert not _loaded(
        'import contextlib, io\nfrom imu_noise_tools.cli import main\n'
        'sys.argv = ["imu_noise", "--help"]\n'
        'with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n'
        '    main.main()') & HEAVY


def test_the_core_imports_without_plots_ros_or_bags():
    loaded = _loaded('import imu_noise_tools.loop.study, imu_noise_tools.noise.problem')
    assert not loaded & {'matplotlib', 'rosbags', 'rclpy', 'yaml', 'allantools'}
    # half a second of each command, which loads scipy.stats too
    assert 'scipy.signal' not in loaded
