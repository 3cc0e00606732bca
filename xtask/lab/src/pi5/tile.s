	.text
	.type	_ZN4tileE,@function
_ZN4tileE:
.Lfunc_begin0:
	.cfi_startproc
	cbz	x8, .LBB0_5
	//APP
	// x12
	//NO_APP
.LBB0_1:
	mov	x9, xzr
.LBB0_2:
	ldr	q0, [x1], #16
	cbz	x4, .LBB0_3
	prfm	pldl1keep, [x4]
.LBB0_3:
	fmla	v2.4s, v0.4s, v1.s[0]	// a comment
	fmla	v3.8h, v0.8h, v1.h[0]
	cmp	x9, x8
	b.lo	.LBB0_2
	bl	_ZN4tileE
	subs	x7, x7, #1
	b.ne	.LBB0_1
.LBB0_5:
	ret
.Lfunc_end0:
	.size	_ZN4tileE, .Lfunc_end0-_ZN4tileE
	.type	_ZN5otherE,@function
_ZN5otherE:
	ret
	.size	_ZN5otherE, 4
	.type	.L__unnamed_1,@object
