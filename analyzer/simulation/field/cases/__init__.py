"""Cases from the field, a module a subject; `registry.field_cases()` has them all."""
