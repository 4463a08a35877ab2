"""What `import specan` offers; see `specan.__init__` for the names."""
