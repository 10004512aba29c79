"""The leaderboard: every controller and agent on every axis."""
