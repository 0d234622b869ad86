"""The MCP server, with which assistants check, inspect and edit robots (`thingc mcp`)."""
