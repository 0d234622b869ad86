"""Parse and evaluate expressions such as `=reach / 2 + 8 mm`.

Every term of an expression has a position in the source text. Physical dimensions are checked during evaluation.

    comparison := sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
    sum        := product (("+" | "-") product)*
    product    := unary (("*" | "/") unary)*
    unary      := ("+" | "-") unary | power
    power      := atom ["**" unary]
    atom       := number [unit] | name | function "(" comparison ("," comparison)* ")" | "(" comparison ")"

A unit belongs to the preceding number, and products of units are written without spaces: `10 mm/rad * q` means (10 mm/rad) q. All other
syntax is an error. Every value is one double, so the time of an evaluation is limited by the length of the expression.
"""
