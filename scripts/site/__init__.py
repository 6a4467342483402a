"""The documentation's site: what mkdocs adds to the pages of docs/ while it builds them."""
