"""The documents: the site's pages, what is generated in them, and the README's tables.

python -m tools.docs.build OUT     the site, with no warning (extra `docs`)
python -m tools.docs.readme        put the generated tables into README.md
python -m tools.docs.numbers       measure the sample again for them
"""
