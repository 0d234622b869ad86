"""Expressions: `=reach / 2 + 8 mm`. A small grammar of its own, with positions; dimensions are checked as it is worked out.

    comparison := sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
    sum        := product (("+" | "-") product)*
    product    := unary (("*" | "/") unary)*
    unary      := ("+" | "-") unary | power
    power      := atom ["**" unary]
    atom       := number [unit] | name | function "(" comparison ("," comparison)* ")" | "(" comparison ")"

A unit binds to the number before it, without spaces around its own `*` and `/`: `10 mm/rad * q` is (10 mm/rad) q.
Nothing else can be written, and working out is bounded by the length of the text: every value is one double.
"""
