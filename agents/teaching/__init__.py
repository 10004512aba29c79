"""Teacher and student: a policy that sees late sensors learns from a controller that knows plan, state and plant."""
