#!/usr/bin/env bash
# Check types with mypy and pyright. The package's folders lie at the root of the repository, so both look at build/types: the
# package as it is installed, made of links to the sources. Links to files, not to folders: pyright skips linked folders.
# Usage: scripts/dev/typecheck.sh [bin folder of the virtual environment, with a slash at its end]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
tools="${1:-}"

rm -rf build/types
mkdir -p build/types/lidarium
cp -rs "$PWD/src/lidarium/." build/types/lidarium/
for folder in envs agents mapping evaluation benchmarks scripts; do
    cp -rs "$PWD/$folder" build/types/lidarium/
done

# The node of the system, where there is one; else pyright fetches its own.
if command -v node > /dev/null; then
    export PYRIGHT_PYTHON_GLOBAL_NODE=1
else
    export PYRIGHT_PYTHON_GLOBAL_NODE=0
fi
export PYRIGHT_PYTHON_IGNORE_WARNINGS=1

echo "mypy"
"${tools}mypy"
echo "pyright"
"${tools}pyright" --pythonpath "$(command -v "${tools}python")"
