"""Say the one thing pyproject cannot: the root folders live below the package name."""

from setuptools import find_packages, setup

FOLDERS = ("envs", "agents", "mapping", "evaluation", "benchmarks", "scripts")

setup(
    package_dir={"lidarium": "src/lidarium", **{f"lidarium.{folder}": folder for folder in FOLDERS}},
    packages=[
        "lidarium",
        *(
            f"lidarium.{package}"
            for package in find_packages(".", include=[pattern for folder in FOLDERS for pattern in (folder, f"{folder}.*")])
        ),
    ],
)
