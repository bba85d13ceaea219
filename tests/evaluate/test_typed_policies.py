"""What names the policy of an evaluation."""

from scengen.evaluate.policies import identity

TYPED = "class Typed:\n    def act(self, observation):\n        return [0.0] * 7\n"


def test_a_policy_that_was_typed_is_another_one_at_each_call():
    """Its text may have changed since, and so may all that it calls."""
    session = {"__name__": "__main__"}
    exec(compile(TYPED, "<cell>", "exec"), session)
    typed = session["Typed"]
    assert identity("__main__:Typed", typed, typed()) != identity("__main__:Typed", typed, typed())
    typed.version = "1"
    assert identity("__main__:Typed", typed, typed()) == identity("__main__:Typed", typed, typed())
