#!/usr/bin/env bash
# Check types with mypy and pyright. Both look at src/lidarium, where an editable install links the root folders.
# Usage: scripts/dev/typecheck.sh [bin folder of the virtual environment, with a slash at its end]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
tools="${1:-}"

if [ ! -e src/lidarium/envs ]; then
    echo "src/lidarium/envs is missing; run pip install -e . first" >&2
    exit 2
fi

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
