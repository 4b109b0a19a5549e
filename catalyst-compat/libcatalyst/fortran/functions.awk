# Writes the Fortran of the table `functions`: with part=interfaces what is linked to, with part=procedures what takes texts of
# Fortran.
BEGIN {
    split("pointer type(C_PTR) index integer(C_SIZE_T) logical logical(C_BOOL) integer integer(C_INT)", words, " ")
    for (i = 1; i in words; i += 2) result[words[i]] = words[i + 1]
    split("path name old_name new_name val schema protocol", texts, " ")
    for (i in texts) is_text[texts[i]] = 1
}
/^#/ || NF == 0 { next }
{
    kind = $1 == "-" ? "subroutine" : "function"
    linked = $2
    private = sub(/^c_/, "", linked) ? "c_" : ""
    linked = "catalyst_conduit_" linked
    list = passed = ""
    takes_text = 0
    for (i = 3; i <= NF; i++) {
        comma = i > 3 ? ", " : ""
        list = list comma $i
        passed = passed comma ($i in is_text ? "trim(" $i ") // C_NULL_CHAR" : $i)
        takes_text += $i in is_text
    }
    if (part == "interfaces") write("    ", private linked, " &\n        bind(C, name=\"" linked "\")", "character(kind=C_CHAR)", "(*)")
    else if (takes_text) write("  ", linked, "", "character(*)", "")
}
function write(margin, name, binding, text, bounds, i, type) {
    print margin kind " " name "(" list ")" (kind == "function" ? " result(res)" : "") binding
    if (part == "interfaces") print margin "  use, intrinsic :: iso_c_binding"
    for (i = 3; i <= NF; i++) {
        if ($i in is_text) print margin "  " text ", intent(in) :: " $i bounds
        else {
            type = $i == "idx" ? "integer(C_SIZE_T)" : $i == "epsilon" ? "real(C_DOUBLE)" : "type(C_PTR)"
            print margin "  " type ", value, intent(in) :: " $i
        }
    }
    if (kind == "function") print margin "  " result[$1] " :: res"
    if (part == "procedures") print margin "  " (kind == "function" ? "res = " : "call ") "c_" linked "(" passed ")"
    print margin "end " kind "\n"
}
