"""Expressions such as `=reach / 2 + 8 mm`: a small grammar with positions. Dimensions are checked during evaluation.

    comparison := sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
    sum        := product (("+" | "-") product)*
    product    := unary (("*" | "/") unary)*
    unary      := ("+" | "-") unary | power
    power      := atom ["**" unary]
    atom       := number [unit] | name | function "(" comparison ("," comparison)* ")" | "(" comparison ")"

A unit belongs to the number before it, without spaces around its own `*` and `/`: `10 mm/rad * q` is (10 mm/rad) q. There are no other
forms. The length of the text bounds the cost of evaluation, because every value is one double.
"""
