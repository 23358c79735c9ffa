{{/* To the database, and to who knows its address. */}}
{{- define "isomatch.egress" -}}
egress:
  - {{ with .Values.networkPolicy.database -}}
    to:
      {{- toYaml . | nindent 6 }}
    {{ end -}}
    ports:
      - port: {{ .Values.networkPolicy.databasePort | default .Values.database.port }}
        protocol: TCP
  - to:
      {{- toYaml .Values.networkPolicy.dns | nindent 6 }}
    ports:
      - port: 53
        protocol: UDP
      - port: 53
        protocol: TCP
{{- end -}}

{{- define "isomatch.metricsIngress" -}}
- from:
    {{- toYaml .Values.networkPolicy.monitoring | nindent 4 }}
  ports:
    - port: metrics
      protocol: TCP
{{- end -}}

{{/* Name, labels and whom a policy is for. (dict "root" . "component" NAME) */}}
{{- define "isomatch.policyHead" -}}
apiVersion: networking.k8s.io/v1
kind: NetworkPolicy
metadata:
  name: {{ include "isomatch.fullname" .root }}-{{ .component }}
  labels:
    {{- include "isomatch.labels" . | nindent 4 }}
  {{- with .annotations }}
  annotations:
    {{- toYaml . | nindent 4 }}
  {{- end }}
spec:
  podSelector:
    matchLabels:
      {{- include "isomatch.selector" . | nindent 6 }}
  policyTypes: [Ingress, Egress]
{{- end -}}
